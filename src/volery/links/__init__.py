"""Links: byte and message streams to autopilots. Connections, codecs, recording tap, fault injection.

Knows the kernel (delivery, time-outs) and wire formats; must not know what a message means to a vehicle. The
only room that imports pymavlink, pyserial and, for a Paparazzi aircraft's files, lxml.
"""
