from xml.etree import ElementTree

from setuptools import find_packages, setup

package_name = 'par4_dynamics'
manifest = ElementTree.parse('package.xml')
maintainer = manifest.find('maintainer')

setup(
    name=package_name,
    version='0.1.0',
    description='Inverse and forward dynamics, models and effects of the Par4 parallel robot.',
    license='Apache-2.0',
    maintainer=maintainer.text,
    maintainer_email=maintainer.get('email'),
    url=manifest.findtext('url'),
    packages=find_packages(),
    py_modules=['par4_dynamics_start'],
    package_data={'par4_dynamics': ['builtin/*.yaml']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
        ('share/' + package_name + '/config', ['config/par4_feedforward.yaml']),
    ],
    install_requires=['lazy-loader', 'numba', 'numpy', 'pydantic', 'scipy'],
    zip_safe=False,
    entry_points={
        'console_scripts': [
            'par4_feedforward = par4_dynamics_start:feedforward',
        ],
    },
)
