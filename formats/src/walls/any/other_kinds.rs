//! Files of plans and maps without a reader, by their extension, and what to do with them.

/// What to do with a file of a known kind; `None` for others, which are taken for vector maps.
pub(super) fn advice(extension: &str) -> Option<&'static str> {
    Some(match extension {
        "dxf" | "dwg" => {
            "a CAD drawing is not read: save it as SVG with a size in mm, or as GeoJSON in metres (QGIS)"
        }
        "pdf" => "a PDF is not read: make an SVG of it (`pdftocairo -svg plan.pdf plan.svg`)",
        "pbstream" => {
            "a map of Cartographer is not read: make a grid of it (`cartographer_pbstream_to_ros_map`) and give its .yaml"
        }
        "posegraph" => {
            "a pose graph of slam_toolbox is not read: save the map (`ros2 run nav2_map_server map_saver_cli`) and give its \
             .yaml"
        }
        "bt" | "ot" | "pcd" | "ply" | "las" | "laz" | "e57" => {
            "a map in three dimensions is not read: make a grid map of it and give its .yaml"
        }
        "ifc" | "rvt" | "skp" | "blend" => {
            "a building model is not read: export a floor as SVG with a size in mm"
        }
        "shp" | "gpkg" | "kml" | "kmz" | "osm" => "save it as GeoJSON: degrees are projected to metres",
        "world" | "sdf" | "urdf" | "xacro" => {
            "a simulation's world is not read: make a grid map in it and give its .yaml"
        }
        "tif" | "tiff" | "gif" | "heic" => {
            "this picture is not read: save it as PNG, and give the .yaml of the grid map"
        }
        _ => return None,
    })
}
