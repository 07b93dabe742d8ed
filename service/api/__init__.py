"""HTTP and WebSocket: routes, messages, errors, settings, a client.

`app` assembles the routes around one `service`, the state that all requests share; `messages` are their JSON.
Routes: `estimates`, `events`, `health`, `locate`, `track`, `robot`, `reactions`, `clips`, `xmlrpc`. Before a
route, `connections`, `access`, `limits` and `known_parameters` refuse what is not allowed, as `errors`.
"""
