"""Laws of bodies: multirotor, rover, wind, battery, terrain, sensors. Imports base only."""
