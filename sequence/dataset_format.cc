#include "sequence/sequence_options.h"

namespace tsdfpp {

const char* DatasetFormatName(DatasetFormat format) {
  switch (format) {
    case DatasetFormat::kCofusion:
      return "cofusion";
    case DatasetFormat::kTum:
      return "tum";
    case DatasetFormat::kBop:
      return "bop";
    case DatasetFormat::kKlg:
      return "klg";
    case DatasetFormat::kScannet:
      return "scannet";
    case DatasetFormat::kReplica:
      return "replica";
    case DatasetFormat::kSevenScenes:
      return "7scenes";
  }
  return "";
}

const std::vector<DatasetFormat>& AllDatasetFormats() {
  static const std::vector<DatasetFormat> all = [] {
    std::vector<DatasetFormat> formats;
    // What has no name is no format any more.
    for (int i = 0; *DatasetFormatName(static_cast<DatasetFormat>(i)) != '\0'; ++i) {
      formats.push_back(static_cast<DatasetFormat>(i));
    }
    return formats;
  }();
  return all;
}

Expected<DatasetFormat> DatasetFormatFromName(std::string_view name) {
  std::string known;
  for (const DatasetFormat format : AllDatasetFormats()) {
    if (name == DatasetFormatName(format)) return format;
    known += fmt::format("{}{}", known.empty() ? "" : ", ", DatasetFormatName(format));
  }
  return UsageError("format '{}' is not known, expected one of {}", name, known);
}

}  // namespace tsdfpp
