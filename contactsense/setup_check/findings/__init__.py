"""What is told of the lines: values to propose, and what the readings say by themselves."""
