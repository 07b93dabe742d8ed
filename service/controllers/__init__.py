"""Interfaces for controllers: samples over WebSocket, XML-RPC and a line socket for robot programs."""
