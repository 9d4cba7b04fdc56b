"""Networks in torch, their first weights, and published ones."""
