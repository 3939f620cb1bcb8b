#include "errors.hpp"

#include <new>

#include "text.hpp"

namespace fork1s::python {
namespace {

const char* NameOf(ErrorCode code) {
  switch (code) {
    case ErrorCode::kFile:
      return "FileError";
    case ErrorCode::kFormat:
      return "FormatError";
    case ErrorCode::kModel:
      return "ModelError";
    case ErrorCode::kUnderdetermined:
      return "UnderdeterminedError";
    case ErrorCode::kNumerics:
      return "NumericsError";
    case ErrorCode::kUsage:
      return "UsageError";
  }
  return "Error";
}

// Sets the Python error of class fork1s._errors.NAME.
void Raise(const char* name, const std::string& text, const std::string& where, const std::string& message) {
  nb::object kind = nb::module_::import_("fork1s._errors").attr(name);
  nb::object exception = kind(nb::cast(text));
  exception.attr("where") = nb::cast(where);
  exception.attr("message") = nb::cast(message);
  PyErr_SetObject(kind.ptr(), exception.ptr());
}

struct UnknownName {
  std::string text;
};

}  // namespace

void RefuseName(const char* what, const std::string& name, const std::vector<std::string>& known) {
  std::string text = "there is no " + std::string(what) + " '" + name + "'";
  if (known.empty()) {
    text += ", nor any other";
  } else {
    text += "; there are: ";
    for (const std::string& k : known) text += (&k == known.data() ? "" : ", ") + k;
  }
  throw UnknownName{text};
}

void BindErrors(nb::module_&) {
  nb::register_exception_translator([](const std::exception_ptr& thrown, void*) {
    try {
      std::rethrow_exception(thrown);
    } catch (const Refused& refused) {
      const Error& e = refused.error;
      Raise(NameOf(e.code), e.Text(), e.where, e.message);
    } catch (const UnknownName& unknown) {
      Raise("UnknownNameError", unknown.text, "", unknown.text);
    } catch (const std::bad_alloc&) {
      PyErr_SetString(PyExc_MemoryError, "out of memory; ask for fewer members, bodies or rows");
    }
  });
}

}  // namespace fork1s::python
