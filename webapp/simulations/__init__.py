"""The simulation experiments of Sakai et al. 2021, section 5; each has the same three names: SETTINGS, run, summarise.

Nothing here knows Flask or SQL. What is learned is learned by `explainer.learning`, what is tested by `analysis`.
"""
