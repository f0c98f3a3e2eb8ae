"""Independent simulator of ships with concealed effects.

It has its own equations, integrated by scipy, and shares none with :mod:`shaftline.plant`. Its effects
have other forms than those of the catalogue.
"""
