"""How the robot moves: the identified model, its controller, wheel slip, and a drive through waypoints. Pure."""
