"""A second, independent ship: what a recording is made of when effects are concealed in it.

Integrated by scipy, with its own formulas; it shares no equation with :mod:`shaftline.plant`. Effects
have other forms here than the ones that a tool under test may know.
"""
