"""The twin: one simulated world that speaks to its clients as two Sawyers behind rosbridge do."""
