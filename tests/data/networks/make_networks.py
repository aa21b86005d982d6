#!/usr/bin/python3
"""Writes the small networks beside it, for tests/mapper/instance_network_test.cc: files as users have them, whose outputs can
be told from their pictures by hand. Needs nothing but Python; the same bytes every time.

    /usr/bin/python3 tests/data/networks/make_networks.py [FOLDER]
"""
import pathlib
import struct
import sys


# Protocol buffers, as far as ONNX and TensorFlow need them here.
def varint(value):
    value &= (1 << 64) - 1
    out = b""
    while True:
        out += bytes([value & 0x7F | (0x80 if value > 0x7F else 0)])
        value >>= 7
        if not value:
            return out


def field(number, value):
    if isinstance(value, int):
        return varint(number << 3) + varint(value)
    if isinstance(value, float):
        return varint(number << 3 | 5) + struct.pack("<f", value)
    if isinstance(value, str):
        value = value.encode()
    return varint(number << 3 | 2) + varint(len(value)) + value


def message(*fields):
    return b"".join(field(number, value) for number, value in fields)


def floats(values):
    return struct.pack(f"<{len(values)}f", *values)


# ONNX (onnx.proto).
FLOAT, INT64 = 1, 7


def tensor(name, sides, values, kind=FLOAT):
    raw = floats(values) if kind == FLOAT else struct.pack(f"<{len(values)}q", *values)
    return message(*[(1, side) for side in sides], (2, kind), (8, name), (9, raw))


def attribute(name, value):
    if isinstance(value, list):
        return message((1, name), *[(8, number) for number in value], (20, 7))
    return message((1, name), (3, value), (20, 2))


def node(kind, inputs, outputs, **attributes):
    return message(*[(1, name) for name in inputs], *[(2, name) for name in outputs], (3, outputs[0]), (4, kind),
                   *[(5, attribute(name, value)) for name, value in attributes.items()])


def described(name, sides):
    shape = message(*[(1, message((1, side))) for side in sides])
    return message((1, name), (2, message((1, message((1, FLOAT), (2, shape))))))


def onnx(nodes, weights, given, wanted):
    graph = message(*[(1, each) for each in nodes], (2, "test"), *[(5, each) for each in weights],
                    *[(11, described(*each)) for each in given], *[(12, described(*each)) for each in wanted])
    return message((1, 6), (2, "make_networks.py"), (7, graph), (8, message((1, ""), (2, 11))))


def conv(name, inputs, rows, bias, stride):
    """A convolution of single pixels: a row of weights an output."""
    weights = [tensor(f"{name}_w", [len(rows), inputs, 1, 1], sum(rows, [])), tensor(f"{name}_b", [len(rows)], bias)]
    return node("Conv", ["frame" if name != "flat" else "mean", f"{name}_w", f"{name}_b"], [name], kernel_shape=[1, 1],
                strides=[stride, stride], pads=[0, 0, 0, 0]), weights


def centres():
    """A thing is where red is above 0.5, its centre where green is; blue is the way to it in columns, (blue - 0.5) * 32, and
    inverse depth that in rows, (q - 1) * 32."""
    made, weights = conv("maps", 5, [[20., 0, 0, 0, 0], [0, 20., 0, 0, 0], [0, 0, 32., 0, 0], [0, 0, 0, 32., 0]],
                         [-10., -10., -16., -32.], 1)
    return onnx([made], weights, [("frame", [1, 5, 32, 32])], [("maps", [1, 4, 32, 32])])


def yolo(table, sides, strides=16):
    """The table of boxes whatever the picture; the first prototype is positive where red is above 0.5, the second everywhere."""
    made, weights = conv("prototypes", 3, [[20., 0, 0], [0., 0, 0]], [-10., 5.], strides)
    flat = [node("GlobalAveragePool", ["frame"], ["mean4"]), node("Flatten", ["mean4"], ["mean"], axis=1),
            node("Gemm", ["mean", "table_w", "table_b"], ["numbers"], transB=1),
            node("Reshape", ["numbers", "sides"], ["boxes"])]
    weights += [tensor("table_w", [len(table), 3], [0.] * 3 * len(table)), tensor("table_b", [len(table)], table),
                tensor("sides", [len(sides)], sides, INT64)]
    return onnx([made, *flat], weights, [("frame", [1, 3, 64, 64])],
                [("prototypes", [1, 2, 64 // strides, 64 // strides]), ("boxes", sides)])


# Boxes of a 64 x 64 input: middle, size, scores of two classes, weights of two prototypes.
BOXES = [
    ([16, 32, 24, 24], [0.9, 0.1], [1, 0]),    # the red in it
    ([17, 32, 24, 24], [0.8, 0.1], [1, 0]),    # the same again
    ([17, 32, 24, 24], [0.1, 0.7], [0, 1]),    # the same place as another class, all of it
    ([48, 32, 16, 16], [0.6, 0.2], [0, -1]),   # nothing of it
    ([48, 32, 16, 20], [0.2, 0.55], [0, 1]),   # all of it
    ([48, 32, 16, 16], [0.3, 0.2], [0, 1]),    # not sure enough
]


def yolo_v8():
    """A column a box."""
    rows = [box + scores + weights for box, scores, weights in BOXES]
    return yolo([float(row[i]) for i in range(8) for row in rows], [1, 8, len(rows)])


def yolo_v5():
    """A row a box, with a score for anything at all before those of classes."""
    rows = [box + [0.95] + [score / 0.95 for score in scores] + weights for box, scores, weights in BOXES]
    return yolo([float(value) for row in rows for value in row], [1, len(rows), 9])


# TensorFlow (graph.proto), with the text that OpenCV takes beside it.
def tf_tensor(sides, values, kind):
    shape = message(*[(2, message((1, side))) for side in sides])
    raw = floats(values) if kind == 1 else struct.pack(f"<{len(values)}i", *values)
    return message((1, kind), (2, shape), (4, raw))


def tf_const(name, sides, values, kind=1):
    value = message((1, "value"), (2, message((8, tf_tensor(sides, values, kind)))))
    dtype = message((1, "dtype"), (2, message((6, kind))))
    return message((1, name), (2, "Const"), (5, value), (5, dtype))


def mask_rcnn():
    """Two detections whatever the picture, and one that is not sure enough; masks of 3 classes, 2 x 2."""
    boxes = [0.25, 0.25, 0.75, 0.5,
             0.5, 0.5, 1.0, 1.0,
             0.0, 0.0, 1.0, 1.0]
    scores = [0, 0.9, 0, 0,  # the last is that of nothing
              0, 0, 0.8, 0,
              0.2, 0, 0, 0.7]
    masks = []
    for wanted, mask in ((1, [1, 1, 1, 1]), (2, [1, 0, 1, 0]), (0, [1, 1, 1, 1])):
        for number in range(3):
            masks += mask if number == wanted else [0] * 4
    consts = []
    for name, values, sides in (("moves", [0] * 12, None), ("scores", scores, None), ("priors", boxes, [1, 1, 12]),
                                ("masks", masks, [3, 3, 2, 2])):
        consts += [tf_const(f"to_{name}", [3, len(values)], [0.] * 3 * len(values)),
                   tf_const(name, [len(values)], [float(value) for value in values])]
        if sides:
            consts.append(tf_const(f"{name}_sides", [len(sides)], sides, 3))
    return message(*[(1, const) for const in consts])


def mask_rcnn_text():
    """The graph, as OpenCV takes it beside the weights: that of its sample from where boxes, scores and masks are known."""
    text = """node { name: "image_tensor" op: "Placeholder" attr { key: "dtype" value { type: DT_FLOAT } } }
node { name: "mean_axes" op: "Const" attr { key: "dtype" value { type: DT_INT32 } }
  attr { key: "value" value { tensor { dtype: DT_INT32 tensor_shape { dim { size: 2 } } int_val: 1 int_val: 2 } } } }
node { name: "mean" op: "Mean" input: "image_tensor" input: "mean_axes"
  attr { key: "keep_dims" value { b: false } } }
"""
    for name in ("moves", "scores", "priors", "masks"):
        text += f"""node {{ name: "flat_{name}" op: "MatMul" input: "mean" input: "to_{name}" }}
node {{ name: "all_{name}" op: "BiasAdd" input: "flat_{name}" input: "{name}" }}
"""
    return text + """node { name: "boxes" op: "Reshape" input: "all_priors" input: "priors_sides" }
node { name: "detection_out_final" op: "DetectionOutput" input: "all_moves" input: "all_scores" input: "boxes"
  attr { key: "num_classes" value { i: 4 } } attr { key: "background_label_id" value { i: 3 } }
  attr { key: "share_location" value { b: true } } attr { key: "code_type" value { s: "CENTER_SIZE" } }
  attr { key: "variance_encoded_in_target" value { b: true } } attr { key: "nms_threshold" value { f: 0.6 } }
  attr { key: "confidence_threshold" value { f: 0.1 } } attr { key: "top_k" value { i: 100 } }
  attr { key: "keep_top_k" value { i: 100 } } }
node { name: "detection_masks" op: "Reshape" input: "all_masks" input: "masks_sides" }
"""


def main():
    folder = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else pathlib.Path(__file__).parent)
    for name, data in (("centres.onnx", centres()), ("yolo_v8.onnx", yolo_v8()), ("yolo_v5.onnx", yolo_v5()),
                       ("mask_rcnn.pb", mask_rcnn()), ("mask_rcnn.pbtxt", mask_rcnn_text().encode())):
        (folder / name).write_bytes(data)


if __name__ == "__main__":
    main()
