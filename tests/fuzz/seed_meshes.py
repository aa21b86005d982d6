"""Seeds of meshes: a file of each format (make_seeds.py)."""
import json
import math
import struct

from seed_files import COLOUR, packed, save

CORNERS = [(0, 0, 0), (0.1, 0, 0), (0, 0.1, 0), (0, 0, 0.1)]
FACES = [(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)]


def ply_ascii():
    text = "ply\nformat ascii 1.0\ncomment region 0 whole\nelement vertex 4\n"
    text += "".join("property float %s\n" % axis for axis in "xyz")
    text += "".join("property uchar %s\n" % colour for colour in ("red", "green", "blue"))
    text += "element face 4\nproperty list uchar int vertex_indices\nproperty ushort region\nend_header\n"
    text += "".join("%g %g %g 200 100 50\n" % corner for corner in CORNERS)
    return text + "".join("3 %d %d %d 0\n" % face for face in FACES)


def ply_binary():
    text = "ply\nformat binary_little_endian 1.0\nobj_info none\nelement vertex 4\n"
    text += "".join("property double %s\n" % axis for axis in "xyz")
    text += "property uchar flags\nelement face 1\nproperty list uchar uint vertex_indices\nproperty int object_id\n"
    text += "element edge 1\nproperty int vertex1\nproperty int vertex2\nend_header\n"
    body = b"".join(struct.pack("<dddB", *corner, 1) for corner in CORNERS)
    return text.encode() + body + struct.pack("<BIIIIi", 4, 0, 1, 2, 3, 7) + struct.pack("<ii", 0, 1)


def obj():
    text = "# a tetrahedron\nmtllib mesh.mtl\no thing\n"
    text += "".join("v %g %g %g 0.5 0.25 1\n" % corner for corner in CORNERS)
    text += "vt 0 0\nvt 1 0\nvt 0 1 0\nvn 0 0 1\nusemtl paint\n"
    text += "f 1/1 3/2 2/3\nf 1/1/1 2/2/1 4/3/1\nusemtl plain\ns off\nf 2//1 3//1 4//1\nf -4 -1 \\\n -2\n"
    mtl = "newmtl paint\nKd 0.8 0.2 0.1\nmap_Kd -o 0 0 0 ../textures/picture.png\nnewmtl plain\nKd 0 1 0\nKa 0 0 0\n"
    return {"meshes/mesh.obj": text, "meshes/mesh.mtl": mtl, "textures/picture.png": COLOUR}


def obj_plain():
    text = "".join("v %g %g %g\n" % corner for corner in CORNERS + [(0.1, 0.1, 0)])
    text += "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 5/3 3/4\nf 1/1 4/2 2/3\n"
    return {"meshes/mesh.obj": text, "textures/picture.png": COLOUR}


def stl_binary():
    out = b"binary" + bytes(74) + struct.pack("<I", len(FACES))
    for face in FACES:
        out += struct.pack("<fff", 0, 0, 1) + b"".join(struct.pack("<fff", *CORNERS[v]) for v in face) + b"\0\0"
    return out


def stl_ascii():
    text = "solid thing\n"
    for face in FACES:
        text += " facet normal 0 0 1\n  outer loop\n"
        text += "".join("   vertex %g %g %g\n" % CORNERS[v] for v in face) + "  endloop\n endfacet\n"
    return text + "endsolid thing\n"


def glb(indexed):
    positions = b"".join(struct.pack("<fff", *corner) for corner in CORNERS)
    colours = b"".join(struct.pack("<HHHH", 65535, 0, 30000, 65535) for _ in CORNERS)
    indices = struct.pack("<12H", *(v for face in FACES for v in face))
    body = positions + colours + indices
    accessors = [{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0, 0, 0],
                  "max": [0.1, 0.1, 0.1]},
                 {"bufferView": 1, "componentType": 5123, "normalized": True, "count": 4, "type": "VEC4"},
                 {"bufferView": 2, "componentType": 5123, "count": 12, "type": "SCALAR", "byteOffset": 0}]
    primitive = {"attributes": {"POSITION": 0, "COLOR_0": 1}, "mode": 4}
    if indexed:
        primitive["indices"] = 2
    else:
        accessors[0]["count"] = accessors[1]["count"] = 3
    document = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 2]}],
        "nodes": [{"name": "root", "rotation": [-math.sqrt(0.5), 0, 0, math.sqrt(0.5)], "children": [1]},
                  {"name": "toy", "mesh": 0, "extras": {"object_id": 3}},
                  {"name": "m", "mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 1, 2, 3, 1]}],
        "meshes": [{"primitives": [primitive]}],
        "accessors": accessors,
        "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": 48},
                        {"buffer": 0, "byteOffset": 48, "byteLength": 32, "byteStride": 8},
                        {"buffer": 0, "byteOffset": 80, "byteLength": 24}],
        "buffers": [{"byteLength": len(body)}]}
    if not indexed:
        document["nodes"][0] = {"name": "root", "translation": [0, 1, 0], "scale": [2, 2, 2], "children": [1]}
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(body), 0x004E4942) + body
    return struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks


def meshes():
    save("ply", "good-ascii", ply_ascii())
    save("ply", "good-binary", ply_binary())
    save("obj", "good-materials", packed(obj()))
    save("obj", "good-plain", packed(obj_plain()))
    save("stl", "good-binary", stl_binary())
    save("stl", "good-ascii", stl_ascii())
    save("gltf", "good-indexed", glb(True))
    save("gltf", "good-plain", glb(False))
