"""The event stream of a run: one schema, its writers and its reader.

Every package that records events imports this one; it imports only `base`. What an event is used for is
decided by those who read the stream.
"""
