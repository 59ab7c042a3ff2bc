"""Models of the Par4: equation (20), the full mechanism, and effects beyond both.

    >>> from par4_dynamics import read_model, state_of_joints
    >>> model = read_model('table1', robot)
    >>> torque = model.torque(state_of_joints(robot.geometry, t, q, qd, qdd))

What is named here is public; it is loaded when it is first used.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(__name__, submod_attrs={
    'base_terms': ['base_columns', 'base_terms'],
    'effects.catalogue': ['CATALOGUE'],
    'effects.effect': [
        'Base', 'Effect', 'EffectParameter', 'Shape', 'Signature', 'Values', 'beyond'],
    'model': ['Model'],
    'model_file': ['EffectEntry', 'ModelFile', 'read_model_file', 'write_model_file'],
    'model_from_file': ['build_model', 'read_model'],
    'parameters': ['Parameter'],
    'state': ['State', 'state_of_joints', 'state_of_platform'],
})
