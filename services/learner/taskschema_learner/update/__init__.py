"""One round's update of the argument network: the policy gradients and their losses."""
