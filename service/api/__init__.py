"""HTTP and WebSocket: routes, messages, errors, settings, a client."""
