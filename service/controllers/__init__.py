"""Ways in for a controller: its own samples over WebSocket, XML-RPC and a line socket for robot programs."""
