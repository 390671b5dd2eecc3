"""Pictures and pages for people: colours, figures as bytes, and the one HTML report. Knows no rover.

Whoever draws imports Matplotlib late: serving JSON must not pay for it, and the serving image has none.
"""
