from xml.etree import ElementTree

from setuptools import find_packages, setup

package_name = 'par4_kinematics'
manifest = ElementTree.parse('package.xml')
maintainer = manifest.find('maintainer')

setup(
    name=package_name,
    version='0.1.0',
    description='Kinematics, motions, files and contract of the Par4 parallel robot.',
    license='Apache-2.0',
    maintainer=maintainer.text,
    maintainer_email=maintainer.get('email'),
    url=manifest.findtext('url'),
    packages=find_packages(),
    py_modules=['par4_start', 'par4_kinematics_start'],
    package_data={'par4_kinematics': ['builtin/*.yaml']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
        ('share/' + package_name + '/config', [
            'config/par4_kinematics.yaml', 'config/par4_motion.yaml']),
    ],
    install_requires=[
        'lazy-loader', 'numba', 'numpy', 'pydantic', 'ruamel.yaml', 'ruckig', 'scipy'],
    zip_safe=False,
    entry_points={
        'console_scripts': [
            'par4_kinematics = par4_kinematics_start:kinematics',
            'par4_motion = par4_kinematics_start:motion',
        ],
    },
)
