"""The network: colour and depth of a frame to four maps of the same size (docs/segmentation.md, "Our own network")."""
import torch
from torch import nn

# Channels of the input: red, green, blue (0 to 1), inverse depth (1/m), whether there is depth.
INPUTS = 5
# Of the output: logit of a pixel being a thing's, logit of being a thing's centre, and the way to the centre of its thing, in
# pixels of the input: columns, rows.
OUTPUTS = 4
# Sides of the input are whole multiples of it.
STRIDE = 16
WIDTHS = (16, 36, 72, 120, 168)


def convolution(inputs, outputs, stride=1, dilation=1):
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, 3, stride=stride, padding=dilation, dilation=dilation, bias=False),
        nn.BatchNorm2d(outputs), nn.ReLU(inplace=True))


class Segmenter(nn.Module):
    """An encoder of five levels and a decoder that adds what it left on the way; plain convolutions, as OpenCV 4.6 has them."""

    def __init__(self):
        super().__init__()
        self.levels = nn.ModuleList()
        inputs = INPUTS
        for level, width in enumerate(WIDTHS):
            layers = [convolution(inputs, width, stride=1 if level == 0 else 2)]
            if level > 0:
                layers.append(convolution(width, width))
            if level == len(WIDTHS) - 1:
                layers += [convolution(width, width, dilation=2), convolution(width, width, dilation=4)]
            self.levels.append(nn.Sequential(*layers))
            inputs = width
        self.narrow = nn.ModuleList(nn.Conv2d(WIDTHS[i + 1], WIDTHS[i], 1) for i in range(len(WIDTHS) - 1))
        self.join = nn.ModuleList(convolution(width, width) for width in WIDTHS[:-1])
        self.up = nn.Upsample(scale_factor=2, mode="nearest")
        self.head = nn.Conv2d(WIDTHS[0], OUTPUTS, 3, padding=1)

    def forward(self, x):
        left = []
        for level in self.levels:
            x = level(x)
            left.append(x)
        for i in reversed(range(len(WIDTHS) - 1)):
            x = self.join[i](self.up(self.narrow[i](x)) + left[i])
        maps = self.head(x)
        # Offsets in pixels, by a factor that keeps what is learned near 1.
        return torch.cat([maps[:, :2], 16 * maps[:, 2:]], dim=1)
