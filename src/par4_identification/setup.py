from xml.etree import ElementTree

from setuptools import find_packages, setup

package_name = 'par4_identification'
manifest = ElementTree.parse('package.xml')
maintainer = manifest.find('maintainer')

setup(
    name=package_name,
    version='0.1.0',
    description='Recording, identification, validation and diagnosis of measured Par4 data.',
    license='Apache-2.0',
    maintainer=maintainer.text,
    maintainer_email=maintainer.get('email'),
    url=manifest.findtext('url'),
    packages=find_packages(),
    py_modules=['par4_identification_start'],
    package_data={'par4_identification': ['reports/templates/*']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
        ('share/' + package_name + '/config', [
            'config/par4_record.yaml', 'config/par4_monitor.yaml']),
        ('share/' + package_name + '/launch', [
            'launch/recording.launch.py', 'launch/identification.launch.py']),
    ],
    install_requires=[
        'backports.zstd', 'click', 'daqp', 'dask', 'distributed', 'lazy-loader', 'lz4',
        'matplotlib', 'numba', 'numpy', 'rich', 'rosbags', 'scipy', 'threadpoolctl'],
    extras_require={'test': ['hypothesis', 'pytest', 'pytest-timeout', 'pytest-xdist']},
    zip_safe=False,
    entry_points={
        'console_scripts': [
            'par4_record = par4_identification_start:record',
            'par4_monitor = par4_identification_start:monitor',
            'par4_excite = par4_identification_start:excite',
            'par4_bag = par4_identification_start:bag',
            'par4_identify = par4_identification_start:identify',
            'par4_validate = par4_identification_start:validate',
            'par4_diagnose = par4_identification_start:diagnose',
            'par4_trend = par4_identification_start:trend',
            'par4_simplification = par4_identification_start:simplification',
            'par4_drive_gain = par4_identification_start:drive_gain',
        ],
    },
)
