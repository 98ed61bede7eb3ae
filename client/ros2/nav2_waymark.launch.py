# Nav2 with the pose of Waymark in place of AMCL: the map server and the navigation nodes of nav2_bringup, and no
# localisation. Waymark broadcasts map -> odom (`map_to_odom = true` for this robot).
#
#   ros2 launch nav2_waymark.launch.py map:=/path/to/map.yaml
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare


def generate_launch_description():
    bringup = FindPackageShare("nav2_bringup")
    params = LaunchConfiguration("params_file")
    use_sim_time = LaunchConfiguration("use_sim_time")
    return LaunchDescription([
        DeclareLaunchArgument("map", description="YAML of the map that Waymark's walls were imported from"),
        DeclareLaunchArgument(
            "params_file", default_value=PathJoinSubstitution([bringup, "params", "nav2_params.yaml"])
        ),
        DeclareLaunchArgument("use_sim_time", default_value="false"),
        Node(
            package="nav2_map_server",
            executable="map_server",
            name="map_server",
            output="screen",
            parameters=[{"yaml_filename": LaunchConfiguration("map"), "use_sim_time": use_sim_time}],
        ),
        Node(
            package="nav2_lifecycle_manager",
            executable="lifecycle_manager",
            name="lifecycle_manager_map",
            output="screen",
            parameters=[{"autostart": True, "node_names": ["map_server"], "use_sim_time": use_sim_time}],
        ),
        IncludeLaunchDescription(
            PythonLaunchDescriptionSource(PathJoinSubstitution([bringup, "launch", "navigation_launch.py"])),
            launch_arguments={"params_file": params, "use_sim_time": use_sim_time, "autostart": "true"}.items(),
        ),
    ])
