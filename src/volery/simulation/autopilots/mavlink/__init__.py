"""MAVLink endpoint of a simulated autopilot: links, streams, microservices, and what differs by firmware."""
