"""What a fit leaves behind: a USD stage, a picture, a report.

Import its modules where needed: pxr is heavy.
"""
