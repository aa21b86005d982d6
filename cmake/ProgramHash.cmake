# Writes a header with the SHA-256 of the files whose names stand in LIST, one a line, relative to ROOT.
# Usage: cmake -DLIST=... -DROOT=... -DMORE="text that counts too" -DHEADER=... -P ProgramHash.cmake
file(STRINGS "${LIST}" files)
set(all "${MORE}\n")
foreach(file ${files})
  file(SHA256 "${ROOT}/${file}" hash)
  string(APPEND all "${file} ${hash}\n")
endforeach()
string(SHA256 hash "${all}")
string(SUBSTRING ${hash} 0 16 hash)
file(WRITE "${HEADER}" "#define TSDFPP_PROGRAM_HASH \"${hash}\"\n")
