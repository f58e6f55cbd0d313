"""The system model in the languages of other tools: UML with MARTE and S3D, AADL, SysML v2."""
