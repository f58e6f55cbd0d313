"""What the client libraries in C++ share: sessions, request handlers, transforms and headers of messages.

Headers that both use are in ``../include``: the encoding of messages and the linear algebra of tf2.
"""
