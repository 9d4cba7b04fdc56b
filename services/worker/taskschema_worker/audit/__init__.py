"""The audit of a task: is it honest, and how hard is it to find a first success?"""
