// Messages of any type as their bytes, for rclpy on Fast DDS: type support that does not read them.
//
// What rclpy calls a ROS message is here a buffer with the CDR bytes behind the encapsulation header; its Python
// side is an object with these bytes as `data`, or plain `bytes` when it arrives. The structures are those of
// rosidl_typesupport_fastrtps_cpp and rosidl_runtime_c (Jazzy, Kilted). Built and loaded by rclpy_types.py.

#include <cstdint>
#include <cstring>
#include <string>

#include "fastcdr/Cdr.h"
#include "rosidl_runtime_c/message_type_support_struct.h"
#include "rosidl_runtime_c/service_type_support_struct.h"
#include "rosidl_runtime_c/string_functions.h"
#include "rosidl_runtime_c/type_description/type_description__functions.h"
#include "rosidl_runtime_c/type_description/type_source__functions.h"
#include "rosidl_typesupport_fastrtps_cpp/message_type_support.h"
#include "rosidl_typesupport_fastrtps_cpp/service_type_support.h"
#include "rosidl_typesupport_introspection_c/message_introspection.h"

// The parts of the Python C API that are used; its headers need not be installed.
typedef struct _object PyObject;
extern "C" {
PyObject * PyObject_GetAttrString(PyObject *, const char *);
int PyBytes_AsStringAndSize(PyObject *, char **, intptr_t *);
PyObject * PyBytes_FromStringAndSize(const char *, intptr_t);
void Py_DecRef(PyObject *);
}

namespace
{
using Bytes = std::string;
using eprosima::fastcdr::Cdr;

const char * const IDENTIFIER = "rosidl_typesupport_fastrtps_c";
const char * const INTROSPECTION = "rosidl_typesupport_introspection_c";

// -- callbacks of Fast DDS

bool serialize(const void * message, Cdr & cdr)
{
  const Bytes & bytes = *static_cast<const Bytes *>(message);
  cdr.serialize_array(bytes.data(), bytes.size());
  return true;
}

bool deserialize(Cdr & cdr, void * message)
{
  Bytes & bytes = *static_cast<Bytes *>(message);
  bytes.clear();
  try {
    for (char next; true; bytes.push_back(next)) {
      cdr.deserialize(next);
    }
  } catch (const eprosima::fastcdr::exception::Exception &) {
    return true;  // the end; the number of bytes is not given
  }
}

uint32_t serialized_size(const void * message)
{
  return static_cast<uint32_t>(static_cast<const Bytes *>(message)->size());
}

size_t max_serialized_size(char & bounds)
{
  bounds = ROSIDL_TYPESUPPORT_FASTRTPS_UNBOUNDED_TYPE;
  return 0;
}

// -- callbacks of rclpy

void * create() {return new Bytes;}

void destroy(void * message) {delete static_cast<Bytes *>(message);}

bool from_python(PyObject * object, void * message)
{
  PyObject * data = PyObject_GetAttrString(object, "data");
  if (!data) {
    return false;
  }
  char * start = nullptr;
  intptr_t size = 0;
  const bool fits = PyBytes_AsStringAndSize(data, &start, &size) == 0;
  if (fits) {
    static_cast<Bytes *>(message)->assign(start, static_cast<size_t>(size));
  }
  Py_DecRef(data);
  return fits;
}

PyObject * to_python(void * message)
{
  const Bytes & bytes = *static_cast<Bytes *>(message);
  return PyBytes_FromStringAndSize(bytes.data(), static_cast<intptr_t>(bytes.size()));
}

// -- a type. `support` is first, so that a pointer to it is a pointer to the type

template<typename Support, typename Callbacks>
struct Type
{
  Support support{};
  Callbacks callbacks{};
  Bytes space, name;
  rosidl_type_hash_t hash{};
  rosidl_runtime_c__type_description__TypeDescription * description;
  rosidl_runtime_c__type_description__TypeSource__Sequence * sources;

  Type(const char * in, const char * called, const uint8_t * digest)
  : space(in), name(called)
  {
    hash.version = 1;
    std::memcpy(hash.value, digest, sizeof hash.value);
    description = rosidl_runtime_c__type_description__TypeDescription__create();
    rosidl_runtime_c__String__assign(&description->type_description.type_name, called);
    sources = rosidl_runtime_c__type_description__TypeSource__Sequence__create(0);
    support.typesupport_identifier = IDENTIFIER;
    support.data = &callbacks;
    support.func = [](const Support * asked, const char * identifier) {
        return std::strcmp(identifier, IDENTIFIER) == 0 ? asked : nullptr;
      };
    support.get_type_hash_func = [](const Support * asked) {
        return const_cast<const rosidl_type_hash_t *>(&of(asked)->hash);
      };
    support.get_type_description_func = [](const Support * asked) {
        return const_cast<const rosidl_runtime_c__type_description__TypeDescription *>(of(asked)->description);
      };
    support.get_type_description_sources_func = [](const Support * asked) {
        return const_cast<const rosidl_runtime_c__type_description__TypeSource__Sequence *>(of(asked)->sources);
      };
  }

  static const Type * of(const Support * support) {return reinterpret_cast<const Type *>(support);}
};

using Message = Type<rosidl_message_type_support_t, message_type_support_callbacks_t>;

// Fast DDS 2 (Jazzy) requires a description of each type; it gets one without members, which it
// does not compare. Fast DDS 3 (Kilted) compares, and goes by the name where there is no description.
#if __has_include("fastrtps/config.h")
const bool IS_DESCRIBED = true;
#else
const bool IS_DESCRIBED = false;
#endif

struct Described : Message
{
  rosidl_typesupport_introspection_c__MessageMembers members{};
  rosidl_message_type_support_t introspection;

  Described(const char * in, const char * called, const uint8_t * digest)
  : Message(in, called, digest), introspection(support)
  {
    members.message_namespace_ = space.c_str();
    members.message_name_ = name.c_str();
    introspection.typesupport_identifier = INTROSPECTION;
    introspection.data = &members;
    support.func = [](const rosidl_message_type_support_t * asked, const char * identifier) {
        const bool tell = IS_DESCRIBED && std::strcmp(identifier, INTROSPECTION) == 0;
        const auto * self = static_cast<const Described *>(of(asked));
        return tell ? &self->introspection : std::strcmp(identifier, IDENTIFIER) == 0 ? asked : nullptr;
      };
  }
};

using Service = Type<rosidl_service_type_support_t, service_type_support_callbacks_t>;
}  // namespace

// Types live as long as the process: rclpy does not report when it no longer needs them.
extern "C" {
// "mavros_msgs::msg", "State", RIHS01 as 32 bytes
const void * carrier_message(const char * space, const char * name, const uint8_t * hash)
{
  Described * made = new Described(space, name, hash);
  made->callbacks.message_namespace_ = made->space.c_str();
  made->callbacks.message_name_ = made->name.c_str();
  made->callbacks.cdr_serialize = serialize;
  made->callbacks.cdr_deserialize = deserialize;
  made->callbacks.get_serialized_size = serialized_size;
  made->callbacks.max_serialized_size = max_serialized_size;
  return made;
}

const void * carrier_service(
  const char * space, const char * name, const uint8_t * hash, const void * request, const void * response)
{
  Service * made = new Service(space, name, hash);
  const auto * asked = static_cast<const rosidl_message_type_support_t *>(request);
  const auto * answered = static_cast<const rosidl_message_type_support_t *>(response);
  made->callbacks = {made->space.c_str(), made->name.c_str(), asked, answered};
  made->support.request_typesupport = asked;
  made->support.response_typesupport = answered;
  return made;
}

const void * carrier_create() {return reinterpret_cast<const void *>(create);}
const void * carrier_destroy() {return reinterpret_cast<const void *>(destroy);}
const void * carrier_from_python() {return reinterpret_cast<const void *>(from_python);}
const void * carrier_to_python() {return reinterpret_cast<const void *>(to_python);}
}
