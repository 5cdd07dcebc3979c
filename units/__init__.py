"""The physics: mesh and anatomy, fibre generator, electrophysiology, active stress, mechanics.

Internal units are mm, ms, mV and MPa. Nothing here knows of FMI libraries or scenario files.
"""
