#include "tools/voxelctl/shape/examples.h"

namespace voxeld::voxelctl {
namespace {

constexpr ShapeExample kExamples[] = {
    {"points",
     "points vertices='-0.6,-0.6,-0.6 -0.2,0.5,-0.3 0.1,-0.4,0 0.5,0.3,0.2 0,0.6,0.4 -0.5,0,0.6 "
     "0.6,-0.6,0.6' "
     "thickness=9 color=yellow"},
    {"segments",
     "segments vertices='-0.8,-0.8,-0.8 0.8,-0.5,-0.5 0.6,0.7,-0.2 -0.6,0.5,0.1 -0.5,-0.5,0.4 "
     "0.5,-0.3,0.6 0.2,0.3,0.8' "
     "topology=strip thickness=4 color=cyan"},
    {"points, soft",
     "points vertices='-0.5,-0.4,-0.4 0.4,0.3,-0.1 -0.1,0.2,0.5' thickness=50 splat=soft "
     "color=skyblue"},
    {"points, cells",
     "points vertices='-3,-2,-2 -2,-2,-2 -1,-2,-2 -1,-1,-2 -1,0,-2 -1,0,-1 -1,0,0 0,0,0 1,0,0 "
     "1,1,0 "
     "1,1,1 2,1,1' splat=cell scale=0.28 turn=20,10,30 color=teal"},
    {"mesh",
     "mesh vertices='-0.8,-0.8,-0.6 0.8,-0.8,-0.6 0,0,0.8 0.8,-0.8,-0.6 0,0.8,-0.6 0,0,0.8 "
     "0,0.8,-0.6 -0.8,-0.8,-0.6 0,0,0.8' "
     "color=gold"},
    {"mesh, a colour a triangle",
     "mesh vertices='-0.8,-0.8,-0.6 0.8,-0.8,-0.6 0,0,0.8 0.8,-0.8,-0.6 0,0.8,-0.6 0,0,0.8 "
     "0,0.8,-0.6 -0.8,-0.8,-0.6 0,0,0.8' "
     "vertices.colors='red gold skyblue' vertices.colors_of=elements"},
    {"mesh, filled",
     "mesh vertices='-0.8,-0.8,-0.6 0.8,-0.8,-0.6 0,0,0.8 0.8,-0.8,-0.6 0,0.8,-0.6 0,0,0.8 "
     "0,0.8,-0.6 -0.8,-0.8,-0.6 0,0,0.8 -0.8,-0.8,-0.6 0,0.8,-0.6 0.8,-0.8,-0.6' "
     "fill=solid color=pink"},
    {"mesh, with a shell",
     "mesh vertices='-0.9,-0.6,-0.6 0,0.6,0.4 -0.9,0.6,-0.6 -0.9,-0.6,-0.6 0,-0.6,0.4 0,0.6,0.4 "
     "0,-0.6,0.4 0.9,0.6,-0.6 "
     "0,0.6,0.4 0,-0.6,0.4 0.9,-0.6,-0.6 0.9,0.6,-0.6' shell=9 "
     "vertices.colors='red gold orange red gold gold gold skyblue gold gold blue skyblue'"},
    {"mesh, textured",
     "mesh vertices='-0.8,-0.8,-0.5 0.8,-0.8,-0.5 0,0,0.7 0.8,-0.8,-0.5 0.8,0.8,-0.5 0,0,0.7 "
     "0.8,0.8,-0.5 -0.8,0.8,-0.5 0,0,0.7 -0.8,0.8,-0.5 -0.8,-0.8,-0.5 0,0,0.7' "
     "texture.coordinates='0,1 1,1 0.5,0 0,1 1,1 0.5,0 0,1 1,1 0.5,0 0,1 1,1 0.5,0' "
     "texture.picture="
     "base64:iVBORw0KGgoAAAANSUhEUgAAABAAAAAIAgMAAACNGJcEAAAADFBMVEX/UCj/3Dw8oP/w8P8BGlucAAAA"
     "JElEQVR42mP4DwQMrJysnAwBEwImMEQERAQwtLK2siKJgZQAABIpDhWsRM2vAAAAAElFTkSuQmCC"},
    {"curve",
     "curve vertices='-0.8,-0.6,-0.5 -0.4,0.7,-0.2 0,-0.6,0 0.4,0.7,0.2 0.8,-0.6,0.5' turn=60,0,0 "
     "thickness=3 color=orange"},
    {"curve, B-spline",
     "curve form=b_spline closed=true vertices='0.8,0,-0.4 0.3,0.5,0.4 -0.2,0.8,-0.4 -0.6,0.3,0.4 "
     "-0.8,-0.4,-0.4 "
     "0,-0.5,0.4 0.5,-0.8,-0.4' thickness=3 color=skyblue"},
    {"arc", "arc radius=0.75 sweep=4.7 turn=30,20,0 thickness=3 color=lime"},
    {"ellipse", "ellipse axis_a=0.85,0,0.3 axis_b=0,0.5,0 thickness=3 color=pink"},
    {"helix",
     "helix start=0,0,-0.8 end=0,0,0.8 radius=0.6 end_radius=0.2 turns=4 thickness=3 color=violet"},
    {"bezier_surface",
     "bezier_surface vertices='-0.8,-0.8,-0.6 -0.27,-0.8,0.2 0.27,-0.8,0.2 0.8,-0.8,-0.6 "
     "-0.8,-0.27,0.2 -0.27,-0.27,1.1 "
     "0.27,-0.27,1.1 0.8,-0.27,0.2 -0.8,0.27,0.2 -0.27,0.27,1.1 0.27,0.27,1.1 0.8,0.27,0.2 "
     "-0.8,0.8,-0.6 "
     "-0.27,0.8,0.2 0.27,0.8,0.2 0.8,0.8,-0.6' color=teal"},
    {"bezier_surface, lines",
     "bezier_surface vertices='-0.8,-0.8,-0.6 -0.27,-0.8,0.2 0.27,-0.8,0.2 0.8,-0.8,-0.6 "
     "-0.8,-0.27,0.2 -0.27,-0.27,1.1 "
     "0.27,-0.27,1.1 0.8,-0.27,0.2 -0.8,0.27,0.2 -0.27,0.27,1.1 0.27,0.27,1.1 0.8,0.27,0.2 "
     "-0.8,0.8,-0.6 "
     "-0.27,0.8,0.2 0.27,0.8,0.2 0.8,0.8,-0.6' fill=lines color=teal"},
    {"bezier_surface, with a shell",
     "bezier_surface vertices='-0.8,-0.8,-0.6 -0.27,-0.8,0.2 0.27,-0.8,0.2 0.8,-0.8,-0.6 "
     "-0.8,-0.27,0.2 -0.27,-0.27,1.1 "
     "0.27,-0.27,1.1 0.8,-0.27,0.2 -0.8,0.27,0.2 -0.27,0.27,1.1 0.27,0.27,1.1 0.8,0.27,0.2 "
     "-0.8,0.8,-0.6 "
     "-0.27,0.8,0.2 0.27,0.8,0.2 0.8,0.8,-0.6' shell=0.16u color=teal\n"
     "clip_plane b=1 d=0.1"},
    {"arrow",
     "arrow start=-0.7,-0.5,-0.6 end=0.6,0.5,0.7 shaft_radius=0.08 head_radius=0.25 color=red"},
    {"text",
     "text text='Aa ßΩ' height=0.42 position=0,-0.25,0 alignment=center facing=0,-1,0.4 up=0,0,1 "
     "depth=0.15 color=gold"},
    {"text, outline",
     "text text=Rose style=outline height=0.5 position=0,0,-0.25 alignment=center facing=0,-1,0 "
     "color=cyan"},
    {"text, strokes",
     "text text='one line\\nof strokes' style=strokes height=0.2 position=0,0,0.2 alignment=center "
     "facing=0,-1,0 color=lime"},
    {"box", "box size=1.2,0.9,0.6 turn=20,10,30 color=orange"},
    {"box, lines", "box size=1.2,0.9,0.6 fill=lines turn=20,10,30 color=orange"},
    {"sphere", "sphere radius=0.8 color=skyblue"},
    {"sphere, a shell cut open",
     "sphere radius=0.8 shell=10 color_scale.along=0,0,1 color_scale.colormap=viridis\n"
     "clip_plane a=-1 b=1 d=0.1"},
    {"sphere, dots", "sphere radius=0.8 fill=dots color=skyblue"},
    {"cylinder", "cylinder radius=0.5 height=1.4 turn=20,15,0 color=lime"},
    {"ellipsoid", "ellipsoid radii=0.9,0.6,0.35 turn=0,20,30 color=pink"},
    {"torus", "torus radius=0.6 tube_radius=0.22 turn=50,0,20 color=violet"},
    {"torus, by a color_scale",
     "torus radius=0.6 tube_radius=0.22 turn=50,0,20 color_scale.along=1,0,0 "
     "color_scale.colormap=plasma"},
    {"cone", "cone start=0,0,-0.8 end=0,0,0.8 start_radius=0.7 end_radius=0.1 color=red"},
    {"cone with round ends",
     "cone start=-0.5,-0.4,-0.4 end=0.5,0.4,0.4 start_radius=0.4 end_radius=0.15 round_ends=true "
     "color=teal"},
    {"parallelepiped",
     "parallelepiped edge_a=1,0.2,0 edge_b=-0.3,0.9,0.2 edge_c=0.2,-0.2,1 color=gray"},
    {"disc", "disc radius=0.85 inner_radius=0.4 normal=0.3,-0.6,1 shell=2 color=gold"},
    {"patch", "patch corner=-0.7,-0.6,-0.3 edge_a=1.3,0.2,0.3 edge_b=0.1,1.1,0.4 color=lime"},
    {"polygon",
     "polygon points='0,-0.9,-0.3 0.25,-0.3,-0.1 0.9,-0.3,-0.1 0.4,0.1,0.03333 0.6,0.8,0.2667 "
     "0,0.4,0.1333 -0.6,0.8,0.2667 -0.4,0.1,0.03333 -0.9,-0.3,-0.1 -0.25,-0.3,-0.1' turn=40,0,0 "
     "shell=2 color=yellow"},
    {"height_map",
     "height_map corner=-0.9,-0.9,0 edge_a=1.8,0,0 edge_b=0,1.8,0 columns=9 rows=9 color=teal "
     "heights="
     "0.4,0.1,-0.1,-0.3,-0.3,-0.3,-0.1,0.1,0.4,0.1,-0.2,-0.4,-0.5,-0.5,-0.5,-0.4,-0.2,0.1,"
     "-0.1,-0.4,-0.5,-0.3,-0.2,-0.3,-0.5,-0.4,-0.1,-0.3,-0.5,-0.3,0.1,0.3,0.1,-0.3,-0.5,"
     "-0.3,-0.3,-0.5,-0.2,0.3,0.5,0.3,-0.2,-0.5,-0.3,-0.3,-0.5,-0.3,0.1,0.3,0.1,-0.3,-0.5,"
     "-0.3,-0.1,-0.4,-0.5,-0.3,-0.2,-0.3,-0.5,-0.4,-0.1,0.1,-0.2,-0.4,-0.5,-0.5,-0.5,-0.4,"
     "-0.2,0.1,0.4,0.1,-0.1,-0.3,-0.3,-0.3,-0.1,0.1,0.4"},
    {"height_map, with a shell",
     "height_map corner=-0.9,-0.9,-0.1 edge_a=1.8,0,0 edge_b=0,1.8,0 columns=5 rows=5 shell=10 "
     "heights=-0.3,0,0.2,0,-0.3,0,0.3,0.5,0.3,0,0.2,0.5,0.7,0.5,0.2,0,0.3,0.5,0.3,0,-0.3,0,0.2,0,-"
     "0.3 color_scale.along=0,0,1 color_scale.colormap=viridis\n"
     "clip_plane a=-1 b=1 d=0.2"},
    {"height_map, textured",
     "height_map corner=-0.9,-0.9,0 edge_a=1.8,0,0 edge_b=0,1.8,0 columns=5 rows=5 "
     "heights=-0.3,0,0.2,0,-0.3,0,0.3,0.5,0.3,0,0.2,0.5,0.7,0.5,0.2,0,0.3,0.5,0.3,0,-0.3,0,0.2,0,-"
     "0.3 "
     "picture="
     "base64:iVBORw0KGgoAAAANSUhEUgAAABAAAAAIAgMAAACNGJcEAAAADFBMVEX/UCj/3Dw8oP/w8P8BGlucAAAA"
     "JElEQVR42mP4DwQMrJysnAwBEwImMEQERAQwtLK2siKJgZQAABIpDhWsRM2vAAAAAElFTkSuQmCC"},
    {"height_map, lines",
     "height_map corner=-0.9,-0.9,0 edge_a=1.8,0,0 edge_b=0,1.8,0 columns=7 rows=7 fill=lines "
     "color=cyan "
     "heights=0.4,0.2,0,0,0,-0.2,-0.4,0.2,0.2,0.2,0,-0.2,-0.3,-0.2,0,0.2,0.4,0.2,-0.2,-0.2,0,0,0,0."
     "2,0.4,"
     "0.2,0,0,0,-0.2,-0.2,0.2,0.4,0.2,0,-0.2,-0.3,-0.2,0,0.2,0.2,0.2,-0.4,-0.2,0,0,0,0.2,0.4"},
    {"volume",
     "volume grid.corner=-0.9,-0.9,-0.9 grid.edge_a=1.8,0,0 grid.edge_b=0,1.8,0 "
     "grid.edge_c=0,0,1.8 grid.size_a=6 "
     "grid.size_b=6 grid.size_c=6 transfer.values=0.1,0.4,0.8 transfer.colors='blue red yellow' "
     "transfer.opacities=0,0.8,1 "
     "grid.samples="
     ".0,.0,.0,.0,.0,.0,.0,.0,.0,.0,.0,.0,.0,.0,.0,.0,.0,.0,.0,.0,.0,.1,.1,.0,.0,.0,.0,.0,.0,.0,.0,"
     ".0,.0,.0,.0,.0,"
     ".0,.0,.0,.0,.0,.0,.0,.1,.1,.0,.0,.0,.1,.2,.2,.2,.2,.1,.1,.2,.3,.4,.5,.2,.0,.1,.1,.3,.3,.1,.0,"
     ".0,.0,.0,.0,.0,"
     ".0,.0,.0,.0,.0,.0,.1,.3,.2,.1,.1,.0,.3,.6,.6,.5,.4,.1,.3,.6,.7,.9,.9,.3,.1,.3,.3,.5,.5,.2,.0,"
     ".0,.1,.1,.1,.0,"
     ".0,.1,.1,.0,.0,.0,.1,.3,.3,.1,.0,.0,.3,.8,.8,.4,.2,.1,.3,.8,.8,.6,.4,.1,.1,.3,.4,.3,.2,.1,.0,"
     ".1,.1,.0,.0,.0,"
     ".0,.0,.0,.0,.0,.0,.1,.2,.2,.1,.0,.0,.2,.4,.4,.2,.0,.0,.2,.4,.4,.2,.1,.0,.1,.2,.2,.1,.0,.0,.0,"
     ".0,.0,.0,.0,.0,"
     ".0,.0,.0,.0,.0,.0,.0,.0,.0,.0,.0,.0,.0,.1,.1,.0,.0,.0,.0,.1,.1,.0,.0,.0,.0,.0,.0,.0,.0,.0,.0,"
     ".0,.0,.0,.0,.0"},
    {"isosurface",
     "isosurface level=0.4 grid.corner=-0.9,-0.9,-0.9 grid.edge_a=1.8,0,0 grid.edge_b=0,1.8,0 "
     "grid.edge_c=0,0,1.8 "
     "grid.size_a=6 grid.size_b=6 grid.size_c=6 color_scale.along=0,0,1 "
     "color_scale.colormap=plasma grid.samples="
     ".0,.0,.0,.0,.0,.0,.0,.0,.0,.0,.0,.0,.0,.0,.0,.0,.0,.0,.0,.0,.0,.1,.1,.0,.0,.0,.0,.0,.0,.0,.0,"
     ".0,.0,.0,.0,.0,"
     ".0,.0,.0,.0,.0,.0,.0,.1,.1,.0,.0,.0,.1,.2,.2,.2,.2,.1,.1,.2,.3,.4,.5,.2,.0,.1,.1,.3,.3,.1,.0,"
     ".0,.0,.0,.0,.0,"
     ".0,.0,.0,.0,.0,.0,.1,.3,.2,.1,.1,.0,.3,.6,.6,.5,.4,.1,.3,.6,.7,.9,.9,.3,.1,.3,.3,.5,.5,.2,.0,"
     ".0,.1,.1,.1,.0,"
     ".0,.1,.1,.0,.0,.0,.1,.3,.3,.1,.0,.0,.3,.8,.8,.4,.2,.1,.3,.8,.8,.6,.4,.1,.1,.3,.4,.3,.2,.1,.0,"
     ".1,.1,.0,.0,.0,"
     ".0,.0,.0,.0,.0,.0,.1,.2,.2,.1,.0,.0,.2,.4,.4,.2,.0,.0,.2,.4,.4,.2,.1,.0,.1,.2,.2,.1,.0,.0,.0,"
     ".0,.0,.0,.0,.0,"
     ".0,.0,.0,.0,.0,.0,.0,.0,.0,.0,.0,.0,.0,.1,.1,.0,.0,.0,.0,.1,.1,.0,.0,.0,.0,.0,.0,.0,.0,.0,.0,"
     ".0,.0,.0,.0,.0"},
    {"instance",
     "object pin: cone start=0,0,-0.4 end=0,0,0.2 start_radius=0.02 end_radius=0.22 color=orange\n"
     "object pin: sphere center=0,0,0.3 radius=0.22 color=gold\n"
     "instance object=pin at=-0.45,0,0\n"
     "instance object=pin at=0.4,0,0.2 turn=0,120,0 scale=1.2 tint=skyblue"},
    {"implicit", "x^2+y^2-z = 0 where x^2+y^2 <= 1"},
    {"implicit, bounded by a spline",
     "implicit surface='z = 0.2*sin(4*x)' color=lime "
     "boundary='catmull_rom -0.8,-0.6,0 0.8,-0.6,0 0.3,0,0 0.8,0.8,0 -0.8,0.7,0 -0.3,0,0'"},
    {"implicit, by level",
     "implicit surface='sin(7*x)*cos(7*y)+sin(7*y)*cos(7*z)+sin(7*z)*cos(7*x) = 0 where "
     "length(x,y,z) <= 0.95' "
     "level='(z+1)/2' colormap=viridis"},
    {"implicit, combined",
     "implicit surface='smin(length(x+0.3,y,z)-0.5, length(x-0.35,y,z)-0.4, 0.4) <= 0 and not "
     "length(x,z)<=0.2' "
     "fill=solid red='0.5+x/2' green='0.5+y/2' blue='0.5+z/2'"},
};

}  // namespace

std::span<const ShapeExample> ShapeExamples() { return kExamples; }

}  // namespace voxeld::voxelctl
