// The names of COCO's classes, which published networks number.
#pragma once

#include <string>
#include <vector>

namespace tsdfpp {

// The 80 that have masks, as YOLO numbers them.
const std::vector<std::string>& CocoClasses80();
// By COCO's own numbers less one, 90 of them, as TensorFlow's networks do; names of numbers that
// COCO gave up are "class 11" and so on.
const std::vector<std::string>& CocoClasses90();

}  // namespace tsdfpp
