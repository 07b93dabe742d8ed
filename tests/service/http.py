"""Requests to services of this host.

Without a client, httpx reads all certificates for each request: a hundred times the rest of its time.
"""

import httpx

# Each request comes in a connection of its own, as if from another client.
_CLIENT = httpx.Client(limits=httpx.Limits(max_keepalive_connections=0))
get, post, put = _CLIENT.get, _CLIENT.post, _CLIENT.put
