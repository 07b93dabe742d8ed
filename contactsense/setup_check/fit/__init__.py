"""How well a setup explains the readings: least squares, with the derivatives by the places of sensors."""
