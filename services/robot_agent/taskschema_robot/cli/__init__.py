"""The `taskschema-robot` command, one module a subcommand."""
