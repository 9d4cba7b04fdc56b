"""The Redis bus between learner, agents and API (docs/protocol.md).

`LearnerBus` and `WorkerBus` carry one trajectory's way; `RunRecords` keeps the facts about runs that
everybody may read. Every message is checked against a typed structure; nothing is ever unpickled.
"""
