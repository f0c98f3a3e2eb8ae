"""shaftline: a workbench for ship propulsion control.

The map of the house:

- ``shaftline.plant``      the physics: propeller, prime movers, shaft, hull, actuators, waves
- ``shaftline.observers``  estimate the advance velocity from shaft measurements
- ``shaftline.baselines``  classic controllers
- ``shaftline.envs``       the Gymnasium environment
- ``shaftline.agents``     learned policies: training, their files, evaluation
- ``shaftline.mismatch``   recording against simulation

These six are the doors. Behind them:

- ``shaftline.core``       compiled machine code, atomic files, sweeps
- ``shaftline.display``    tables and figures that commands share
- ``shaftline.proof``      the diagnosis on concealed effects, scored
- ``shaftline.studies``    published results reproduced side by side; policies on trial; speed
- ``shaftline.cli``        the ``shaftline`` command
"""
