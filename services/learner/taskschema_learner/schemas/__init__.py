"""What became of a schema: files, signatures, and how it relates to the paper's."""
