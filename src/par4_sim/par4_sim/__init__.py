"""The simulated Par4: plants, drives, sensors, controllers, and bags of what they do.

    >>> from par4_sim import build_simulation, simulate_to_bag
    >>> simulation = build_simulation(robot, model, 'exact', seed=1, torque_noise=0.1)
    >>> simulate_to_bag(simulation, motion, robot, 'bag')

What is named here is public; it is loaded when it is first used.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(__name__, submod_attrs={
    'bags.bag_writer': ['BagWriter'],
    'closed_loop.offline': ['simulate_to_bag'],
    'closed_loop.simulation': ['build_plant', 'build_simulation'],
    'drives.reference': ['ReferenceQueue'],
    'drives.reference_curve': ['ReferenceLimits'],
})
