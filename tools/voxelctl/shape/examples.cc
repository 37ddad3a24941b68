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
    {"mesh",
     "mesh vertices='-0.8,-0.8,-0.6 0.8,-0.8,-0.6 0,0,0.8 0.8,-0.8,-0.6 0,0.8,-0.6 0,0,0.8 "
     "0,0.8,-0.6 -0.8,-0.8,-0.6 0,0,0.8' "
     "color=gold"},
    {"box", "box size=1.2,0.9,0.6 turn=20,10,30 color=orange"},
    {"sphere", "sphere radius=0.8 color=skyblue"},
    {"cylinder", "cylinder radius=0.5 height=1.4 turn=20,15,0 color=lime"},
    {"ellipsoid", "ellipsoid radii=0.9,0.6,0.35 turn=0,20,30 color=pink"},
    {"torus", "torus radius=0.6 tube_radius=0.22 turn=50,0,20 color=violet"},
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
    {"implicit", "x^2+y^2-z = 0 where x^2+y^2 <= 1"},
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
