"""What the sensors make of the world: light to grey values, motion to readings of an IMU. Pure."""
