"""Bodies and their motion: the Pioneer and its controller, cars, rails, hands, quadrotors, recorded paths. Pure."""
