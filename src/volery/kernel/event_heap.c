/* The module volery.kernel.event_heap in C: the same order as event_heap.py, whose docstrings apply. */

#define PY_SSIZE_T_CLEAN
#include <Python.h>

/* Times are read by PyLong_AsUnsignedLong, digit by digit; the function for long long reads byte by byte. */
_Static_assert(sizeof(long) == 8, "a time in ns has 64 bits");

/* An entry with its order: times are not negative, and those beyond 64 bits count as the last. */
typedef struct {
    unsigned long long when, ticket;
    PyObject *entry;
} Event;

typedef struct {
    PyObject_HEAD
    Event *events;
    Py_ssize_t count, room;
} EventHeap;

static PyTypeObject EventHeapType;

static inline int before(const Event *a, const Event *b)
{
    return a->when < b->when || (a->when == b->when && a->ticket < b->ticket);
}

static int number(PyObject *entry, Py_ssize_t place, unsigned long long *found)
{
    *found = PyLong_AsUnsignedLong(PyTuple_GET_ITEM(entry, place));
    if (*found == (unsigned long long)-1 && PyErr_Occurred()) {
        if (!PyErr_ExceptionMatches(PyExc_OverflowError))
            return -1;
        PyErr_Clear();
    }
    return 0;
}

/* Read an entry, without a reference to it. */
static int read_event(PyObject *entry, Event *event)
{
    if (!PyTuple_Check(entry) || PyTuple_GET_SIZE(entry) < 2) {
        PyErr_SetString(PyExc_TypeError, "an event is a tuple of its time, its ticket and what happens");
        return -1;
    }
    event->entry = entry;
    return number(entry, 0, &event->when) < 0 || number(entry, 1, &event->ticket) < 0 ? -1 : 0;
}

/* Let the event take the place of the first, or one below it. */
static void sink(EventHeap *heap, Event event)
{
    Event *events = heap->events;
    Py_ssize_t place = 0, child;
    while ((child = 2 * place + 1) < heap->count) {
        if (child + 1 < heap->count && before(&events[child + 1], &events[child]))
            child++;
        if (before(&event, &events[child]))
            break;
        events[place] = events[child];
        place = child;
    }
    events[place] = event;
}

static int is_filled(EventHeap *heap)
{
    if (heap->count == 0)
        PyErr_SetString(PyExc_IndexError, "no event is left");
    return heap->count > 0;
}

static int add(EventHeap *heap, PyObject *entry)
{
    Event event;
    if (read_event(entry, &event) < 0)
        return -1;
    if (heap->count == heap->room) {
        Py_ssize_t room = heap->room ? 2 * heap->room : 64;
        Event *events = PyMem_Resize(heap->events, Event, room);
        if (events == NULL) {
            PyErr_NoMemory();
            return -1;
        }
        heap->events = events;
        heap->room = room;
    }
    Event *events = heap->events;
    Py_ssize_t place = heap->count++;
    while (place > 0 && before(&event, &events[(place - 1) / 2])) {
        events[place] = events[(place - 1) / 2];
        place = (place - 1) / 2;
    }
    events[place] = event;
    Py_INCREF(entry);
    return 0;
}

static EventHeap *as_heap(PyObject *object)
{
    if (Py_IS_TYPE(object, &EventHeapType))
        return (EventHeap *)object;
    PyErr_Format(PyExc_TypeError, "an EventHeap is needed, not %s", Py_TYPE(object)->tp_name);
    return NULL;
}

static EventHeap *heap_of(PyObject *const *given, Py_ssize_t count)
{
    if (count == 2)
        return as_heap(given[0]);
    PyErr_SetString(PyExc_TypeError, "a heap and an event are needed");
    return NULL;
}

static PyObject *heappush(PyObject *Py_UNUSED(module), PyObject *const *given, Py_ssize_t count)
{
    EventHeap *heap = heap_of(given, count);
    if (heap == NULL || add(heap, given[1]) < 0)
        return NULL;
    Py_RETURN_NONE;
}

static PyObject *heappop(PyObject *Py_UNUSED(module), PyObject *object)
{
    EventHeap *heap = as_heap(object);
    if (heap == NULL || !is_filled(heap))
        return NULL;
    PyObject *first = heap->events[0].entry;
    heap->count--;
    if (heap->count > 0)
        sink(heap, heap->events[heap->count]);
    return first;
}

static PyObject *heapreplace(PyObject *Py_UNUSED(module), PyObject *const *given, Py_ssize_t count)
{
    EventHeap *heap = heap_of(given, count);
    Event event;
    if (heap == NULL || !is_filled(heap) || read_event(given[1], &event) < 0)
        return NULL;
    PyObject *first = heap->events[0].entry;
    Py_INCREF(event.entry);
    sink(heap, event);
    return first;
}

static Py_ssize_t heap_length(EventHeap *heap)
{
    return heap->count;
}

static PyObject *heap_item(EventHeap *heap, Py_ssize_t place)
{
    if (place >= 0 && place < heap->count)
        return Py_NewRef(heap->events[place].entry);
    PyErr_SetString(PyExc_IndexError, "no such event");
    return NULL;
}

static int heap_init(EventHeap *heap, PyObject *given, PyObject *names)
{
    PyObject *entries = NULL;
    if (!PyArg_ParseTuple(given, "|O", &entries) || entries == NULL)
        return PyErr_Occurred() ? -1 : 0;
    PyObject *iterator = PyObject_GetIter(entries), *entry;
    if (iterator == NULL)
        return -1;
    while ((entry = PyIter_Next(iterator)) != NULL) {
        int added = add(heap, entry);
        Py_DECREF(entry);
        if (added < 0)
            break;
    }
    Py_DECREF(iterator);
    return PyErr_Occurred() ? -1 : 0;
}

static int heap_traverse(EventHeap *heap, visitproc visit, void *arg)
{
    for (Py_ssize_t place = 0; place < heap->count; place++)
        Py_VISIT(heap->events[place].entry);
    return 0;
}

static int heap_clear(EventHeap *heap)
{
    Event *events = heap->events;
    Py_ssize_t count = heap->count;
    heap->events = NULL;
    heap->count = heap->room = 0;
    for (Py_ssize_t place = 0; place < count; place++)
        Py_DECREF(events[place].entry);
    PyMem_Free(events);
    return 0;
}

static void heap_dealloc(EventHeap *heap)
{
    PyObject_GC_UnTrack(heap);
    heap_clear(heap);
    Py_TYPE(heap)->tp_free((PyObject *)heap);
}

static PySequenceMethods heap_sequence = {
    .sq_length = (lenfunc)heap_length,
    .sq_item = (ssizeargfunc)heap_item,
};

static PyTypeObject EventHeapType = {
    PyVarObject_HEAD_INIT(NULL, 0)
    .tp_name = "volery.kernel.event_heap.EventHeap",
    .tp_basicsize = sizeof(EventHeap),
    .tp_flags = Py_TPFLAGS_DEFAULT | Py_TPFLAGS_HAVE_GC,
    .tp_new = PyType_GenericNew,
    .tp_init = (initproc)heap_init,
    .tp_dealloc = (destructor)heap_dealloc,
    .tp_traverse = (traverseproc)heap_traverse,
    .tp_clear = (inquiry)heap_clear,
    .tp_as_sequence = &heap_sequence,
};

static PyMethodDef functions[] = {
    {"heappush", (PyCFunction)(void (*)(void))heappush, METH_FASTCALL, NULL},
    {"heappop", (PyCFunction)heappop, METH_O, NULL},
    {"heapreplace", (PyCFunction)(void (*)(void))heapreplace, METH_FASTCALL, NULL},
    {NULL},
};

static PyModuleDef module = {
    PyModuleDef_HEAD_INIT, .m_name = "volery.kernel.event_heap", .m_size = -1, .m_methods = functions
};

PyMODINIT_FUNC PyInit_event_heap(void)
{
    if (PyType_Ready(&EventHeapType) < 0)
        return NULL;
    PyObject *made = PyModule_Create(&module);
    if (made != NULL && PyModule_AddObjectRef(made, "EventHeap", (PyObject *)&EventHeapType) < 0)
        Py_CLEAR(made);
    return made;
}
