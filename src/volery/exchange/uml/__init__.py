"""UML with MARTE and S3D as Papyrus stores it: one module for each view, which reads it and writes it."""
