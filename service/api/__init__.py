"""HTTP and WebSocket: routes, messages, settings, a client.

`app` assembles the `routes` around one `service`, the state that all requests share; `messages` are their
JSON. What a request must pass before is in `http`.
"""

READY = "serving at "
"""Beginning of the line on stdout with which `contactsense serve` names its address."""
