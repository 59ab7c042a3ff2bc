"""Recording, identification, validation and diagnosis of measured Par4 data.

    >>> from par4_identification import diagnose, identify, read_log
    >>> logs = [read_log(bag, robot) for bag in ('first', 'second')]
    >>> parameters = identify(logs, robot).parameters
    >>> diagnosis = diagnose(logs, robot)
    >>> [(cause.effect.name, cause.joints) for cause in diagnosis.causes]

What is named here is public; it is loaded when it is first used.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(__name__, submod_attrs={
    'changes.changes': ['Changes'],
    'diagnosis.diagnosis': ['LIBRARY', 'diagnose'],
    'diagnosis.experiment.next_experiment': ['next_experiment'],
    'diagnosis.search.rules': ['Rules'],
    'diagnosis.verdict.answer': ['Cause', 'Diagnosis', 'Unusable'],
    'estimators.consistent': ['consistent'],
    'estimators.estimate': ['Estimate'],
    'estimators.instrumental': ['instrumental'],
    'estimators.ordinary': ['ordinary'],
    'estimators.problem': ['Problem', 'Series', 'problem_of', 'with_offsets'],
    'estimators.robust': ['robust'],
    'estimators.weighted': ['weighted'],
    'fitting.identification': ['Identification', 'identify'],
    'fitting.physical': ['physical_constraints'],
    'fitting.validation': ['validate'],
    'logs.log': ['Log', 'Reference'],
    'logs.read_log': ['read_log'],
    'setup_check.check': ['check_setup'],
    'signals.conditioning': ['Conditioning'],
    'signals.rows': ['runs_of_log'],
    'signals.run': ['Run'],
})
