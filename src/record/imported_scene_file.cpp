#include <new>

#include "hdf5_disk.hpp"
#include "hdf5_file.hpp"
#include "model_store.hpp"
#include "record/imported_scene_file.hpp"

namespace fork1s {

using namespace internal;

Expected<void> SaveImportedScene(const ImportedScene& imported, const std::string& path) {
  const QuietHdf5 quiet;
  DiskState disk;
  try {
    const Hdf5 access = DiskAccess(disk);
    Hdf5 file(H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, access.id()), H5Fclose);
    if (!file) throw Hdf5Fault("cannot be written (" + LastHdf5Message() + ')');
    {
      const Hdf5 group = CreateGroup(file.id(), "imported");
      WriteModel(group.id(), WriteImportedScene(imported));
    }
    if (!file.Close()) throw Hdf5Fault("cannot be written (" + LastHdf5Message() + ')');
  } catch (const Hdf5Fault& e) {
    if (!disk.failed()) return Fail(ErrorCode::kFile, path, e.what());
  }
  if (disk.failed()) return Fail(ErrorCode::kFile, path, "cannot be written: " + disk.Reason());
  return {};
}

Expected<ImportedScene> LoadImportedScene(const std::string& path) {
  const QuietHdf5 quiet;
  try {
    const FileFacts facts = InspectFile(path);
    // HDF5's own driver follows links, and a file in memory has no other name.
    DiskState disk;
    const Hdf5 access = DiskAccess(disk);
    const Hdf5 file(H5Fopen(path.c_str(), H5F_ACC_RDONLY, access.id()), H5Fclose);
    if (!file) throw Hdf5Fault("cannot be opened as HDF5 (" + LastHdf5Message() + "); write it again");
    const Hdf5 group = OpenGroup(file.id(), "imported");
    return ReadImportedScene(ReadModel(group.id(), facts.MostBytes()), path);
  } catch (const Hdf5Fault& e) {
    return Fail(e.code(), path, e.what());
  } catch (const std::bad_alloc&) {
    return Fail(ErrorCode::kFile, path,
                "does not fit into memory; close other programs or simplify the model");
  }
}

}  // namespace fork1s
