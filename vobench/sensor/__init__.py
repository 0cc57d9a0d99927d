"""What the sensors make of the world: light to grey values, wheel angles to encoder counts. Pure."""
