"""`python -m taskschema_learner`: the `taskschema` command where that is not installed, as in a Ray job."""

from taskschema_learner.cli.main import main

if __name__ == "__main__":
    main()
