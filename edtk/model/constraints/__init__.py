"""What a calibration pose must satisfy, one kind of constraint a file."""
