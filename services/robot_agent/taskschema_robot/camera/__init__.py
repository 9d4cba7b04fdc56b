"""The overhead camera: frames with the time they were taken."""
