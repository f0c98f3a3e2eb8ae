"""shaftline: a workbench for ship propulsion control.

The map of the house:

- ``shaftline.plant``      the physics: propeller, engine, shaft, hull, actuators, waves
- ``shaftline.observers``  estimate the advance velocity from shaft measurements
- ``shaftline.baselines``  classic controllers
- ``shaftline.envs``       the Gymnasium environment
- ``shaftline.agents``     training of learned policies
- ``shaftline.mismatch``   recording against simulation
- ``shaftline.studies``    published tables reproduced side by side; speed
- ``shaftline.cli``        the ``shaftline`` command
"""
