"""The central learner, its worker pool, the HTTP API and the `taskschema` command."""
