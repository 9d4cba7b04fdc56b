"""Batched kinematics of the arms: rotations, forward kinematics, Jacobian, inverse kinematics."""
