"""What people and programs see of a training: terminal, lines of JSON, pictures, TensorBoard."""
