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
  static const std::vector<DatasetFormat> all = {
      DatasetFormat::kCofusion,   DatasetFormat::kTum,     DatasetFormat::kBop,
      DatasetFormat::kKlg,        DatasetFormat::kScannet, DatasetFormat::kReplica,
      DatasetFormat::kSevenScenes};
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
