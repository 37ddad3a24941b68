// The help texts of voxelctl, and of those commands whose texts are longer than a line.
#pragma once

namespace voxeld::voxelctl {

inline constexpr const char* kAbout =
    "Puts files into the volumetric displays of a voxeld server, and shows how they do.\n"
    "Data goes to standard output, words to standard error; --json makes the data JSON.";
inline constexpr const char* kPlayAbout =
    "Puts files up: meshes (.obj .stl .ply .gltf .glb .off .fbx .3mf .dae .blend .ifc .bvh and "
    "more), voxels (.vox),\n"
    "point clouds (.ply .pcd .las .xyz .txt .asc .pts .csv), maps (.geojson .topojson .json "
    ".shp .gpx .kml),\n"
    "volumes (.nii .nii.gz .nrrd .nhdr .mha .mhd .mrc .rec .map .tif .tiff .raw .dcm, a folder of\n"
    "DICOM slices), molecules (.pdb .ent "
    ".cif .mmcif .xyz),\n"
    "drawings (.svg); sequences of them ('frame_####.obj') and animations (--animate).\n"
    "The scene is turned upright, centred and made as large as fits. Light is baked into the "
    "colours by the\n"
    "direction of each surface, so that shape can be read on a display that only glows (--flat: "
    "not).\n"
    "What is up stays when this ends, in the layer \"voxelctl\", until the next play, or clear.\n"
    "A test pattern that is up ends.";
inline constexpr const char* kDemoAbout =
    "Plays scenes that are worth a look, one after another, until Ctrl-C; a SCENE that is named "
    "stays up alone.\n"
    "  voxelctl demo\n"
    "  voxelctl demo globe life --seconds 60\n"
    "  voxelctl demo --list\n"
    "Those whose data are not on this machine are passed over, and what brings them is said. At "
    "the end it takes down\n"
    "what it put up. What voxelctl put up before goes.";
inline constexpr const char* kDrawAbout =
    "Puts up shapes, each in quotes: a name with values, or an expression.\n"
    "  voxelctl draw \"sphere radius=0.8 color=orange\" \"box size=1,0.5,0.2 turn=0,0,30\"\n"
    "  voxelctl draw \"x^2+y^2-z = 0 where x^2+y^2 <= 1\"\n"
    "  voxelctl draw \"object pin: cone end=0,0,0.4 start_radius=0 end_radius=0.1\" "
    "\"object pin: sphere center=0,0,0.45 radius=0.1\"\n"
    "                \"instance object=pin at=0.5,0,0 tint=red\" \"instance object=pin\"\n"
    "  voxelctl draw \"sphere radius=0.8\" \"clip_plane c=1\" \"mask: box size=1 fill=solid\"\n"
    "The last shows what is in a mask, above a plane; clip_box and clip_cylinder clip too.\n"
    "Values are the fields of the shape (docs/primitives.md), and color, at, scale, turn "
    "(degrees), "
    "priority, erase,\n"
    "label, lifetime (s). What is up stays when this ends, in the layer \"voxelctl\", until the "
    "next "
    "draw or play, or clear.";
inline constexpr const char* kSnapshotAbout =
    "Draws what a display shows, rebuilt from the bytes that go out to it, as a PNG: in "
    "perspective, dimmer with\n"
    "distance, with the outline of its volume; with --slices all its slices side by side.";
inline constexpr const char* kRenderAbout =
    "Draws what a display shows as a viewer sees it who walks around it: a GIF, an MP4 (by the "
    "program ffmpeg),\n"
    "numbered PNGs, or one PNG. It is one volume in all pictures; with --live, what is shown at "
    "the time of each.\n"
    "  voxelctl render turn.gif\n"
    "  voxelctl render turn.mp4 --frames 240 --fps 30 --turns 2 --size 1280x960\n"
    "  voxelctl render 'turn/####.png' --frames 36";
inline constexpr const char* kExportAbout =
    "Writes the volume as a display shows it: .ply has its lit pixels as coloured points in "
    "millimetres, .vox its voxels\n"
    "for MagicaVoxel in 255 colours, .npz for numpy rgb (slices, height, width, 3), positions_mm "
    "of the lit ones in the\n"
    "order of rgb.any(axis=3).nonzero(), and metadata, which is JSON.";
inline constexpr const char* kGalleryAbout =
    "Draws an example of every shape, one after another, and puts what a display shows of each\n"
    "into one picture. What voxelctl put up before goes.";
inline constexpr const char* kCalibrateAbout =
    "Shows patterns on a display, which it opens itself (voxeld must not have it), asks what is "
    "seen, "
    "and writes the\n"
    "display's profile with what was found: orientation, mirrors, eccentricity, keystone.";
inline constexpr const char* kVerifyAbout =
    "Holds a display's device to its protocol, case by case, and says what is not as it must be. "
    "Opens the device\n"
    "itself: no voxeld may have it. DISPLAY is what voxeld's --display takes, such as\n"
    "voxlink,serial=A1 or fadecandy; simulated,size=32x32x16 is the emulated device, to try it.\n"
    "Ends with 0 if no case failed, 1 if one did, 3 if there is no device.";
inline constexpr const char* kPatternAbout =
    "Shows a test pattern instead of the scene: axes, corners, grid, ramp, "
    "white, bars, density, slices, posts or frames; none ends it, list names them";
inline constexpr const char* kProfileAbout =
    "check: reads a display's description and says what it comes to, without a "
    "daemon. list: names those that are installed.";
inline constexpr const char* kWatchAbout =
    "Lists layers and entities, then what comes (+), changes (~) and goes (-), until "
    "Ctrl-C; with --json one object a change set, each the scene's step to the next "
    "state that the server told";
inline constexpr const char* kWhyAbout =
    "Says why an entity is, or is not, to be seen: outside, black, clipped, masked, hidden, "
    "covered and by "
    "what, or where the display has no light. The server finds out by drawing, which may take "
    "seconds";
inline constexpr const char* kInitAbout =
    "Asks how an LED lattice is wired (start corner, direction, zig-zag) and writes its "
    "profile; needs no daemon";
inline constexpr const char* kRecordAbout =
    "Records the scene, with all that changes, into an MCAP file, until Ctrl-C; other viewers show "
    "its "
    "channel \"scene\"";
inline constexpr const char* kReplayAbout =
    "Puts a recorded scene up again, at the pace at which it was, bit for bit; it goes at the end. "
    "What an earlier replay of the file has left (--keep) goes when it is up";
inline constexpr const char* kClearAbout =
    "Takes down what voxelctl put up: the layer of play and draw, what replay --keep and pipe "
    "--keep have left, and test patterns. Without the scope control the caller's own, and what "
    "stays is told";
inline constexpr const char* kPlaylistAbout =
    "Plays recordings and presets one after another by a playlist, cross-faded, each at its hours, "
    "until Ctrl-C";
inline constexpr const char* kMarkersAbout =
    "Shows what a robot's programs send to their viewers (foxglove.SceneUpdate, from a Foxglove "
    "WebSocket server), until Ctrl-C";
inline constexpr const char* kAssetsAbout =
    "Brings files to the server, which keeps them by their SHA-256 for clients to name (pictures, "
    "samples, vertices);\nwithout FILE: what it has of them";
inline constexpr const char* kInputAbout =
    "Takes lights in from what feeds LED controllers, until Ctrl-C: PROTOCOL is opc (Open Pixel "
    "Control), ddp,\n"
    "e131 (sACN) or artnet. Light n is the display's own, if that is a lattice; else --size or "
    "--layout says where it is.\n"
    "The newest picture is shown; those that came too fast are counted, and told.";
inline constexpr const char* kPipeAbout =
    "Shows raw pictures from standard input, one after another: red, green and blue of each light, "
    "a byte each,\n"
    "x fastest, then y, then z.  makes-light | voxelctl pipe --size 16x16x16";
inline constexpr const char* kTokenAbout =
    "Makes a token that shows who a client is (VOXELD_TOKEN), and its entry for the daemon's "
    "grants file; needs no daemon";
inline constexpr const char* kTopAbout =
    "Shows how the server and its displays do, live: state, volumes a second, latency by stage, "
    "what "
    "was lost and\n"
    "superseded, clients, memory, connections. q ends it, p pauses, tab and arrows choose a "
    "display. "
    "Where there is no\n"
    "terminal, tables instead; with --json a line each. NO_COLOR: no colours.";
inline constexpr const char* kCompletionAbout =
    "Prints the script by which a shell completes voxelctl, the server's names too (Debian's "
    "package "
    "has them installed)\n"
    "  source <(voxelctl completion bash)\n"
    "  voxelctl completion fish >~/.config/fish/completions/voxelctl.fish";
inline constexpr const char* kDoctorAbout =
    "Says what of this machine keeps voxeld from its work, and the command that mends it; "
    "needs no daemon. Ports are 50551, or that of --server 127.0.0.1:PORT, and 8088";

}  // namespace voxeld::voxelctl
