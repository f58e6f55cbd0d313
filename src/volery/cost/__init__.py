"""Laws of computing: what ROS calls, code and energy take on a processor. Imports base only."""
