"""The experiment as plain Python, without input or output: protocol, texts, counterbalancing, session, questionnaire.

A web worker imports this package, so it needs nothing heavier than pydantic.
"""
