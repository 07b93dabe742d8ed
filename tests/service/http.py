"""Requests to services of this host.

Without a client, httpx reads all certificates for each request: a hundred times the rest of its time.
"""

import httpx

PATIENCE = 60.0
"""Time for an answer [s]: on a busy computer the description of the interface takes more than five."""
# Each request comes in a connection of its own, as if from another client.
_CLIENT = httpx.Client(limits=httpx.Limits(max_keepalive_connections=0), timeout=PATIENCE)
get, post, put = _CLIENT.get, _CLIENT.post, _CLIENT.put
