from xml.etree import ElementTree

from setuptools import find_packages, setup

package_name = 'par4_sim'
manifest = ElementTree.parse('package.xml')
maintainer = manifest.find('maintainer')

setup(
    name=package_name,
    version='0.1.0',
    description='Simulated Par4 with drives and sensors, in pybullet and in reduced coordinates.',
    license='Apache-2.0',
    maintainer=maintainer.text,
    maintainer_email=maintainer.get('email'),
    url=manifest.findtext('url'),
    packages=find_packages(),
    py_modules=['par4_sim_start'],
    package_data={'par4_sim': ['report/templates/*', 'report/uplot/*', 'tracking/templates/*']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
        ('share/' + package_name + '/config', ['config/par4_simulation.yaml']),
        ('share/' + package_name + '/launch', [
            'launch/cell.launch.py', 'launch/simulation.launch.py']),
        ('share/' + package_name + '/rviz', ['rviz/par4.rviz']),
        ('share/' + package_name + '/layouts', [
            'layouts/par4.plotjuggler.xml', 'layouts/par4.foxglove.json']),
    ],
    install_requires=[
        'click', 'daqp', 'jinja2', 'lazy-loader', 'markupsafe', 'matplotlib', 'numba', 'numpy',
        'pybullet', 'rich', 'rosbags', 'scipy', 'toppra'],
    zip_safe=False,
    entry_points={
        'console_scripts': [
            'par4_simulation = par4_sim_start:simulation',
            'par4_cell = par4_sim_start:cell',
            'par4_simulate = par4_sim_start:simulate',
            'par4_fastest = par4_sim_start:fastest',
            'par4_track = par4_sim_start:track',
            'par4_push = par4_sim_start:push',
        ],
    },
)
