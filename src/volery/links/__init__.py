"""Links to autopilots: connections (UDP, TCP, serial, in process) and codecs (MAVLink, pprzlink).

A link moves frames, which are named messages with fields; a codec converts frames to bytes and back. This
package knows the kernel (delivery, time-outs) and the wire formats. It does not know what a message means to
a vehicle. It is the only package that imports pymavlink and pyserial.
"""
